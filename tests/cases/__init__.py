"""Scenario files, recordings, trials and logs that several tests use."""

from pathlib import Path

__all__ = ["POND", "ROV"]

#: A short voyage with fixes only: the text of its file.
POND = Path(__file__).with_name("pond.toml").read_text(encoding="utf-8")
#: A slow ROV with a DVL at 23 Hz and a MEMS IMU: its file.
ROV = Path(__file__).with_name("rov.toml")
