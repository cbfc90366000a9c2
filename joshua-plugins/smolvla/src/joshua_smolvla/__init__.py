"""SmolVLA on a robot: from pictures, joints and a task in plain words to joint positions."""
