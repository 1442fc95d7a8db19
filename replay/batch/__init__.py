"""Many runs: what recordings gave before, and whether they still do."""
