"""From picture to attitude: the steps, what is told of their outcome, which search is next."""
