"""Clients of the nodes: any bus, one class per sensor."""
