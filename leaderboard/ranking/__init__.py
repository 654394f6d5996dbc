"""What results say: statistics, runs of one estimator condensed, the ranking and its table."""
