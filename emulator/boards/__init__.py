"""The boards: a processor and what its pins lead to; one folder per sensor."""
