"""What a network of Lee (2010) loses with fewer stations, longer baselines, rougher skies."""
