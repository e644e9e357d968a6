"""Identities of centroids: geometric voting, assisted matching, tracking."""
