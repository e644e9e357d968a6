"""Where pictures lie and how they get there, by memory layout."""
