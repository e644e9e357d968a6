"""Exports of an interface for people and programs."""
