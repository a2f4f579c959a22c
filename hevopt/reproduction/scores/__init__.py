"""Problems of others, or with a solution on paper, and what is known of their optimum beside what is found here."""
