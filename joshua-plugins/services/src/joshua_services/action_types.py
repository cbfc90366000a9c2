"""Types of ROS 2's action FollowJointTrajectory, which the message store lacks.

Source: control_msgs of ROS 2 Jazzy; action_msgs and rosidl for the parts of every action.
"""

from __future__ import annotations

from joshua.messages.services import define

ACTION = "control_msgs/action/FollowJointTrajectory"
CANCEL = "action_msgs/srv/CancelGoal"

_UUID = "unique_identifier_msgs/UUID goal_id"
_POINT = "trajectory_msgs/JointTrajectoryPoint"
_MULTI = "trajectory_msgs/MultiDOFJointTrajectoryPoint"


def define_types() -> None:
    """Register the types in this process."""
    define(
        {
            CANCEL: (
                "action_msgs/GoalInfo goal_info",
                "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
            )
        },
        {
            "control_msgs/msg/JointTolerance": (
                "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration"
            ),
            "control_msgs/msg/JointComponentTolerance": (
                "string joint_name\nuint16 component\n"
                "float64 position\nfloat64 velocity\nfloat64 acceleration"
            ),
        },
    )
    define_action(
        ACTION,
        goal=(
            "trajectory_msgs/JointTrajectory trajectory\n"
            "trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\n"
            "control_msgs/JointTolerance[] path_tolerance\n"
            "control_msgs/JointComponentTolerance[] component_path_tolerance\n"
            "control_msgs/JointTolerance[] goal_tolerance\n"
            "control_msgs/JointComponentTolerance[] component_goal_tolerance\n"
            "builtin_interfaces/Duration goal_time_tolerance"
        ),
        result="int32 error_code\nstring error_string",
        feedback=(
            "std_msgs/Header header\nstring[] joint_names\n"
            f"{_POINT} desired\n{_POINT} actual\n{_POINT} error\n"
            f"string[] multi_dof_joint_names\n{_MULTI} multi_dof_desired\n{_MULTI} multi_dof_actual\n"
            f"{_MULTI} multi_dof_error"
        ),
    )


def define_action(action: str, goal: str, result: str, feedback: str) -> None:
    """Register an action: its two services and its messages, as rosidl derives them."""
    define(
        {
            f"{action}_SendGoal": (
                f"{_UUID}\n{action}_Goal goal",
                "bool accepted\nbuiltin_interfaces/Time stamp",
            ),
            f"{action}_GetResult": (_UUID, f"int8 status\n{action}_Result result"),
        },
        {
            f"{action}_Goal": goal,
            f"{action}_Result": result,
            f"{action}_Feedback": feedback,
            f"{action}_FeedbackMessage": f"{_UUID}\n{action}_Feedback feedback",
        },
    )
