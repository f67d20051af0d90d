"""params.yaml as frozen models: its sections, profiles and variants."""
