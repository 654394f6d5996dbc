"""Submissions: an estimator with its results in one file, and whether it holds when it is repeated elsewhere.

`simnav.leaderboard.submission.bundle` says what the file holds. A bundle is data from others: nothing in it is
unpickled, and its estimator is imported in confined processes only.
"""
