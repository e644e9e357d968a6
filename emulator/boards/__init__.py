"""The boards: which pin goes where; one folder for each sensor."""
