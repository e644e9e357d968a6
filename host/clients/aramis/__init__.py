"""AraMiS' client."""
