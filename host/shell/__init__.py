"""The register shell: read, write and watch by the tables' names."""
