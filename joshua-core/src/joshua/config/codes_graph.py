"""Diagnostic codes of the rules that hold blocks against each other: identity, devices, topics, QoS."""

from __future__ import annotations

from joshua.textproto.code_doc import CodeDoc

GRAPH_CODES: dict[str, CodeDoc] = {
    # Identity and devices
    "duplicate-node-id": CodeDoc(
        "Two nodes have the same node_id.",
        "Give one of them the free id that the message names.",
    ),
    "duplicate-node-name": CodeDoc(
        "Two nodes have the same name in the same namespace.",
        "Rename one of them or give it a ros_namespace of its own.",
    ),
    "actuator-name-shared": CodeDoc(
        "Two actuators differ in their namespace only; a calibration knows its actuator by node_name.",
        "Give each actuator a node_name of its own.",
    ),
    "process-group-split": CodeDoc(
        "Nodes of one process group name different machines or interpreters, but share one process.",
        "Give them the same host and python, or different groups.",
    ),
    "serial-port-shared": CodeDoc(
        "Two nodes of one machine would open the same serial port.",
        "Give each device the port of its own adapter.",
    ),
    "ble-device-shared": CodeDoc(
        "Two nodes of one machine would connect to the same Bluetooth device.",
        "Rename one of the hubs, or let one node drive all its ports.",
    ),
    "camera-shared": CodeDoc(
        "Two nodes of one machine would open the same camera; device_id is 0 where it is left out.",
        "Give each camera its own device_id, or its own source.",
    ),
    "duplicate-motor-id": CodeDoc(
        "Two motors of one bus have the same id.",
        "Write each motor's own id once; a new servo is given its id with the maker's tool.",
    ),
    # Topics
    "topic-type-mismatch": CodeDoc(
        "Endpoints of one topic have different message types, so they do not connect.",
        "Use one data_type for the topic, or two topics.",
    ),
    "topic-unpublished": CodeDoc(
        "A node subscribes to a topic that no node of the file publishes.",
        "Correct the name; ignore this if another ROS 2 system publishes the topic.",
    ),
    "topic-two-publishers": CodeDoc(
        "Two publishers of the file publish one topic, so subscribers get both streams mixed.",
        "Give each publisher its own topic.",
    ),
    "command-topic-two-publishers": CodeDoc(
        "Two publishers command one actuator, which would jerk between the two.",
        "Give one its own topic, or mark the one that takes over with override: true.",
    ),
    "topic-feedback": CodeDoc(
        "A node subscribes to the topic that it publishes itself.",
        "Subscribe to the topic of the node that is meant.",
    ),
    "data-type-unfit": CodeDoc(
        "The device cannot publish, or cannot be commanded by, messages of this type.",
        "Use one of the types that are allowed.",
    ),
    "subscription-unfit": CodeDoc(
        "The device takes no input, so the subscription would have no effect.",
        "Remove the subscription.",
    ),
    "sensor-unpublished": CodeDoc(
        "A sensor publishes no topic, so nobody gets what it measures.",
        "Add a publishers block to its node.",
    ),
    # Quality of service
    "qos-incompatible": CodeDoc(
        "A subscription requests more than the publisher offers, and ROS 2 does not connect such a pair.",
        "Lower the request or raise the offer in the setting that the message names.",
    ),
    "deadline-below-period": CodeDoc(
        "The deadline is shorter than the period of the publish rate, so each message misses it.",
        "Raise deadline_s or publish_rate_hz.",
    ),
    # Calibration
    "calibration-duplicate": CodeDoc(
        "One actuator is calibrated twice.",
        "Remove the older calibration.",
    ),
    "calibration-unknown-node": CodeDoc(
        "A calibration names an actuator that the file does not have.",
        "Correct node_name; ignore this if several files share the calibration.",
    ),
    "calibration-unknown-motor": CodeDoc(
        "A calibration holds a motor that the bus does not have: it was made for another arm.",
        "Calibrate again, or correct motor_ids.",
    ),
    "calibration-incomplete": CodeDoc(
        "A calibration lacks motors of the bus.",
        "Calibrate again.",
    ),
    "calibration-interrupted": CodeDoc(
        "A calibration ended while it was being written, as by a power cut: servos and file may disagree.",
        "Run joshua calibrate --recover with the arm connected.",
    ),
    "duplicate-joint-name": CodeDoc(
        "Two motors of one arm have the same joint name, and joints are matched by name.",
        "Give each joint its own name.",
    ),
    # Safe state
    "park-pose-missing": CodeDoc(
        "PARK_THEN_RELEASE is set without the pose to park in.",
        "Add park_pose_rad with one angle for each joint.",
    ),
    "park-pose-unfit": CodeDoc(
        "The park pose has another number of angles than the actuator has joints.",
        "Write one angle for each joint, in joint order.",
    ),
    "safe-state-unfit": CodeDoc(
        "The actuator cannot reach this safe state: a leader has no torque, or its plugin cannot park.",
        "Choose a safe state that the message allows.",
    ),
    # Transport
    "endpoint-invalid": CodeDoc(
        "A Zenoh endpoint is not of the form protocol/address:port.",
        "Write it like tcp/localhost:7447 or tls/robot.local:7447.",
    ),
    "peer-invalid": CodeDoc(
        "A DDS peer is no host name and no IP address.",
        "Write the address alone, without protocol and port.",
    ),
    "transport-field-unused": CodeDoc(
        "A setting belongs to the other middleware and has no effect with the kind that is chosen.",
        "Remove it, or change kind.",
    ),
    "transport-open": CodeDoc(
        "The robot listens beyond this machine without encryption: whoever reaches it can command it.",
        "Use tls endpoints with a tls block, or stay on localhost.",
    ),
    "tls-missing": CodeDoc(
        "An encrypted endpoint has no certificates.",
        "Add a tls block with the three files.",
    ),
    "tls-unused": CodeDoc(
        "Certificates are given and no endpoint uses them.",
        "Write tls/ in place of tcp/ in the endpoints.",
    ),
    "tls-may-not-hold": CodeDoc(
        "Encryption is configured, and the environment could still choose DDS, which has none here.",
        "Add kind: TRANSPORT_ZENOH.",
    ),
    "hosts-apart": CodeDoc(
        "Nodes run on several machines and the transport stays on loopback.",
        "Add a transport block with endpoints that the machines reach.",
    ),
}
