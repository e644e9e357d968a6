"""AraMiS' board."""
