"""Parameters at random, for the properties of the environments."""

from hypothesis import strategies as st

evasion_arguments = st.fixed_dictionaries(
    {
        "n_opponents": st.integers(1, 5),
        "opponent_speed": st.sampled_from([0.0, 0.7, 3.2, 10.0, 60.0, 1000.0]),
        "agent_speed": st.sampled_from([0.5, 2.0, 7.3]),
        "path_length": st.sampled_from([3.0, 22.0, 31.7]),
        "main_path_length": st.sampled_from([1.0, 12.5, 30.0]),
        "noise": st.sampled_from([0.0, 0.02, 0.9, 5.0]),
        "time_step": st.sampled_from([0.1, 0.3, 1.0]),
        "collision_distance": st.sampled_from([0.0, 0.5, 2.0]),
        "trial_limit": st.sampled_from([0.5, 4.0, 20.0]),
        "observe_direction": st.booleans(),
        "start": st.sampled_from(["anywhere", "either end", "same end"]),
        "bounce": st.sampled_from(["reflect", "turn"]),
    }
)
