"""From image to attitude: the steps, the report of their outcome, and the next search."""
