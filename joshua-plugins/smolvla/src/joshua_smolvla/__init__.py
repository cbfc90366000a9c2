"""SmolVLA on a robot: pictures, joints and a task in plain words in, joint positions out."""
