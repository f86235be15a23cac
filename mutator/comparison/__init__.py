"""Two runs of the same faults compared, experiment by experiment: what became better, worse, hazardous."""
