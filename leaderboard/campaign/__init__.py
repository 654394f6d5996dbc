"""Running estimators: one attempt in isolation, campaigns of many, and the keys of what they give."""
