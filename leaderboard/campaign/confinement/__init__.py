"""Estimators in processes that never held a recording.

Each worker of a campaign has a **server** (`server`): a fresh Python process, started before the worker simulates
anything. It loads the kernels that an estimator may call before the first estimator that calls them. For each run the
server forks an **estimator process** (`estimator_process`). It is told which estimator it is, gets datasheets, start
and the packets of one step after the other over a pipe, and answers in the plain form of `simnav.trial.wire`. The
worker's side is `session`; nothing that comes from an estimator process is unpickled. What the operating system offers
beyond that is in `landlock` and `bubblewrap`.
"""
