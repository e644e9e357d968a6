"""Clients of the nodes: any bus, and one class for each sensor."""
