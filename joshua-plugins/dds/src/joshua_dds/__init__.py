"""ROS 2 topics over DDS, by the conventions of rmw_cyclonedds and rmw_fastrtps."""
