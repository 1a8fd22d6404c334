"""Files: gain files, states of jobs, reports, verdicts."""
