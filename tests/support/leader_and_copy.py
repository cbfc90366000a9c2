"""The file of a mock leader and an arm that copies it."""

LEADER_AND_COPY = """
general { mode: MODE_TELEOPERATE name: "bench" id: "bench-001" }
robot {
  actions {
    node { node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 20 } }
    action_type: ACTION_LEADER mock_motor_config { num_motors: 2 position_max: 4095 }
  }
  actions {
    node { node_name: "copy" node_id: 2
      subscriptions { data_type: JOINT_STATE topic_name: "/arm/joint_states" } }
    action_type: ACTION_FOLLOWER mock_motor_config { num_motors: 2 position_max: 4095 }
  }
}
"""
