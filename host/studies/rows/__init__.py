"""Figures of the documents as data: values with limits, and the code that they depend on."""
