"""The page of a comparison, and the saved form that it is made from."""
