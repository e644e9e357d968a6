"""AraMiS' image sensor MT9M001."""
