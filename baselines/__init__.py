"""The paper's baselines and the floors, one file a method, written as an outside entrant would."""
