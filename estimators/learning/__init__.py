"""Tasks for learning agents around a running filter, and the estimators that trained policies become.

- ``reference.py``: the plain filter, and what it leaves behind: the linear problem of each step
- ``bank.py``: the same linear problem with other noise, for one filter or a bank of them, as kernels
- ``voyage.py``: a recording, the plain filter, the oracle and the truth, step by step
- ``tasks.py``, ``rewards.py``: actions of the tasks, and what they are worth
- ``environment.py``, ``vector.py``: the Gymnasium environment of one voyage, and of many
- ``policy.py``, ``policy_estimator.py``: a trained policy as a file of plain arrays, and as an estimator
"""
