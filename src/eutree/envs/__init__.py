"""The N-Evasion domain of the paper, and scripted experts for it and for Gymnasium's tasks."""
