"""How little any plan could cost: duals, the lower-bound dynamic program, and the certificate they make."""
