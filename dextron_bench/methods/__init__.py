"""Methods: what an agent and a learner offer, how they are found, and agents in processes of their own."""
