"""The paper's experiments as data: settings, what runs, how it is judged."""
