"""The page of a study of tip-ins."""
