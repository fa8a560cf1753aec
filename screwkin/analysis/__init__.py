"""What results are worth: verdicts on walks, comparisons of models and methods, maps."""
