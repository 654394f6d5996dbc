"""The site: pages, their templates and their figures."""
