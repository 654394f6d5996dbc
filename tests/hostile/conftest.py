"""The plug-ins here are run by campaigns, not by pytest."""

collect_ignore = ["cheats"]
