"""Campaigns: the same measurement over thousands of skies, on all cores or a cluster, resumable."""
