"""The packaged models: they compile, stand still, and carry the published figures."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from joshua_mujoco_sim.actuator_group import ActuatorGroup
from joshua_mujoco_sim.cameras import OVERVIEW, camera_names, field_of_view_rad
from joshua_mujoco_sim.catalog import PACKAGED_MODELS, find_packaged, packaged_names
from joshua_mujoco_sim.model_file import Attachment, ModelError, load_model, model_file
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer

#: Published ranges of the SO-ARM100, rad.
RANGES = {
    "shoulder_pan": (-2.2, 2.2),
    "shoulder_lift": (-3.14158, 0.2),
    "elbow_flex": (0.0, 3.14158),
    "wrist_flex": (-2.0, 1.8),
    "wrist_roll": (-3.14158, 3.14158),
    "gripper": (-0.2, 2.0),
}

#: Published masses of its moving links, kg.
MASSES = {
    "Rotation_Pitch": 0.119226,
    "Upper_Arm": 0.162409,
    "Lower_Arm": 0.147968,
    "Wrist_Pitch_Roll": 0.0661321,
    "Fixed_Jaw": 0.0929859,
    "Moving_Jaw": 0.0202444,
}

ARMS = [name for name in packaged_names() if name.startswith(("so_arm100/", "lekoch/"))]


@pytest.mark.parametrize("name", packaged_names())
def test_stands_still_for_two_seconds(name: str) -> None:
    physics = Physics(load_model(name))
    physics.step(round(2 / physics.timestep_s))
    assert physics.time_s == pytest.approx(2.0, abs=physics.timestep_s)
    assert np.isfinite(physics.data.qpos).all()
    if "lekoch.xml" not in name:  # it has no floor to stand on
        assert np.abs(physics.data.qvel).max() < 0.5


@pytest.mark.parametrize("name", ARMS)
def test_arm_has_the_published_figures(name: str) -> None:
    model = load_model(name)
    for joint, limits in RANGES.items():
        assert model.joint(joint).range == pytest.approx(limits)
        assert model.actuator(joint).ctrlrange == pytest.approx(limits)
        stall = 1.675 if joint == "gripper" else 3.35  # half of it squeezes enough
        assert model.actuator(joint).forcerange == pytest.approx((-stall, stall))
    for body, mass_kg in MASSES.items():
        assert model.body(body).mass[0] == pytest.approx(mass_kg)


def test_arm_has_the_published_link_lengths() -> None:
    physics = Physics(load_model("so_arm100/so_arm100.xml"))
    physics.data.qpos[:] = 0
    mujoco.mj_forward(physics.model, physics.data)
    origin = {body: physics.data.body(body).xpos.copy() for body in MASSES}
    lengths = {
        ("Rotation_Pitch", "Upper_Arm"): np.hypot(0.1025, 0.0306),
        ("Upper_Arm", "Lower_Arm"): 0.1160,
        ("Lower_Arm", "Wrist_Pitch_Roll"): 0.1350,
        ("Wrist_Pitch_Roll", "Fixed_Jaw"): 0.0601,
    }
    for (inner, outer), length_m in lengths.items():
        assert np.linalg.norm(origin[outer] - origin[inner]) == pytest.approx(length_m, abs=1e-4)


def test_jaw_closes_on_its_pads_and_opens_away_from_them() -> None:
    physics = Physics(load_model("so_arm100/so_arm100.xml"))

    def gap_m(angle_rad: float) -> float:
        physics.data.qpos[:] = 0
        physics.data.qpos[5] = angle_rad
        mujoco.mj_forward(physics.model, physics.data)
        a, b = (physics.data.geom(f"{jaw}_jaw_pad_4").xpos for jaw in ("fixed", "moving"))
        return float(np.linalg.norm(a - b))

    assert gap_m(-0.17) < 0.005
    assert 0.03 < gap_m(0.5) < gap_m(1.0)


@pytest.mark.parametrize("name", [name for name in ARMS if name.startswith("so_arm100/")])
def test_jaws_do_not_pass_through_each_other(name: str) -> None:
    physics = Physics(load_model(name))
    goal = physics.group(()).position_rad
    goal[5] = -0.2
    physics.group(()).set_command(goal)
    physics.step(round(2 / physics.timestep_s))
    assert -0.19 < physics.group(()).position_rad[5] < -0.1
    depth_m = -min(physics.data.contact.dist)
    assert depth_m < 0.001


def test_a_grip_has_its_site_between_the_jaws_and_squeezes_with_half_of_the_stall_torque() -> None:
    physics, arm, pose, _ = _gripping(np.array([0.0, -0.27, 0.0125]))
    arm.set_command(pose)
    physics.step(500)
    grip, cube = physics.data.site("gripper").xpos, physics.data.body("cube").xpos
    assert np.abs(grip - cube).max() < 0.008
    assert abs(arm.torque[5]) == pytest.approx(1.675, abs=0.01)


def _gripping(cube_at: np.ndarray) -> tuple[Physics, ActuatorGroup, np.ndarray, np.ndarray]:
    """The arm around a cube, the pose in which its jaws close, and the place of its grip."""
    physics = Physics(load_model("so_arm100/pick_place.xml"))
    arm = physics.group(tuple(RANGES))
    address = physics.model.joint("cube").qposadr[0]
    physics.data.qpos[address : address + 3] = cube_at
    around = cube_at + np.array([0.0, 0.0, 0.004])
    arm.set_position(_pose_over(physics.model, around + np.array([0, 0, 0.06])))
    for height_m in np.linspace(0.06, 0.0, 40):
        pose = _pose_over(physics.model, around + np.array([0, 0, height_m]))
        arm.set_command(pose)
        physics.step(15)
    pose[5] = 0.0
    return physics, arm, pose, around


@pytest.mark.parametrize("place", [(0.0, -0.27), (0.06, -0.26), (-0.1, -0.24)])
def test_the_top_camera_sees_the_cube_between_the_jaws(place: tuple[float, float]) -> None:
    try:
        choose_gl()
    except RenderingError as error:
        pytest.skip(f"no picture can be drawn here: {error}")
    physics, arm, pose, _ = _gripping(np.array([*place, 0.0125]))
    arm.set_command(pose)
    physics.step(500)
    renderer = CameraRenderer(physics.model, "top", 320, 240)
    try:
        renderer.look(physics.data)
        red, green, blue = renderer.draw().astype(int).transpose(2, 0, 1)
    finally:
        renderer.close()
    assert ((red > 2.5 * green) & (red > 2.5 * blue) & (red > 60)).sum() > 25


def test_a_free_drive_lets_the_arm_fall_and_a_braked_one_lets_it_sink() -> None:
    ways = []
    for free in (True, False):
        physics = Physics(load_model("so_arm100/scene.xml"))
        arm = physics.group(())
        start = arm.position_rad
        for _ in range(300):  # 0.6 s
            if free:
                arm.let_go()
            else:
                arm.set_command(arm.position_rad)
            physics.step()
        assert not free or np.abs(arm.torque).max() < 0.02
        ways.append(np.abs(arm.position_rad - start).max())
    assert ways[0] > 0.25
    assert ways[1] < 0.1


def test_arm_lifts_the_cube() -> None:
    """Friction, pads and drives together: a closed jaw carries the cube up."""
    physics, arm, pose, around = _gripping(np.array([0.0, -0.27, 0.0125]))
    arm.set_command(pose)
    physics.step(500)
    for height_m in np.linspace(0.0, 0.08, 60):
        pose[:5] = _pose_over(physics.model, around + np.array([0, 0, height_m]))[:5]
        arm.set_command(pose)
        physics.step(15)
    physics.step(250)
    assert physics.data.body("cube").xpos[2] > 0.06


def _pose_over(model: mujoco.MjModel, target_m: np.ndarray) -> np.ndarray:
    """Joint positions, shape (6,): jaw open, pointing down, its grip at a place; by iteration."""
    data = mujoco.MjData(model)
    pose = np.array([0.0, -1.57, 1.57, 1.57, -1.57, 0.9])
    site = model.site("gripper").id
    for _ in range(100):
        data.qpos[:6] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        position, rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacSite(model, data, position, rotation, site)
        lean = data.site_xmat[site].reshape(3, 3)[:, 1] - [0, 0, 1]  # the jaw points along its -y
        rows = np.vstack([position[:, :4], rotation[:1, :4]])
        error = np.append(target_m - data.site_xpos[site], lean[1])
        pose[:4] += 0.5 * np.linalg.lstsq(rows, error, rcond=None)[0]
    return pose


def test_lekoch_drives_forwards_and_turns_on_its_rollers() -> None:
    physics = Physics(load_model("lekoch/scene.xml"))
    wheels = [physics.model.actuator(name).id for name in ("wheel_left", "wheel_right", "wheel_back")]
    physics.data.ctrl[wheels] = [3.0, -3.0, 0.0]
    physics.step(1000)
    x, y, z = physics.data.body("lekoch").xpos
    assert y < -0.25
    assert abs(x) < 0.05
    assert z == pytest.approx(0.05, abs=0.005)
    physics.data.ctrl[wheels] = [3.0, 3.0, 3.0]
    physics.step(1000)
    yaw_speed = physics.data.joint("lekoch").qvel[5]
    assert abs(yaw_speed) == pytest.approx(3.0 * 0.05 / 0.125, rel=0.1)


def test_every_file_of_the_models_folder_is_listed_or_included() -> None:
    for model in PACKAGED_MODELS:
        assert model.path.is_file()
        assert not model.mjx or find_packaged(model.mjx)


def test_own_file_is_found_relative_to_the_folder(tmp_path) -> None:
    (tmp_path / "mine.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    assert model_file("mine.xml", tmp_path) == tmp_path / "mine.xml"
    assert load_model("mine.xml", tmp_path).ngeom == 1


def test_urdf_is_read_and_can_be_driven_and_seen(tmp_path) -> None:
    (tmp_path / "arm.urdf").write_text(
        '<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" '
        'iyy="1" iyz="0" izz="1"/></inertial></link><link name="tip"><inertial><mass value="1"/><inertia '
        'ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><joint name="elbow" '
        'type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/><limit lower="-1" '
        'upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    model = load_model("arm.urdf", tmp_path)
    assert model.joint("elbow").range == pytest.approx((-1, 1))
    physics = Physics(model)
    arm = physics.group(())
    assert (arm.names, arm.joints, arm.kinds) == (("elbow",), ("elbow",), ("position",))
    assert arm.force_limit == pytest.approx([1.0])
    arm.set_command(np.array([0.5]))
    physics.step(2000)
    assert arm.position_rad == pytest.approx([0.5], abs=0.02)
    assert camera_names(model) == ["overview"]
    link = Attachment("arm.urdf", "second/", (1.0, 0.0, 0.0))
    together = load_model("arm.urdf", tmp_path, [link])
    assert [together.actuator(k).name for k in range(together.nu)] == ["elbow", "second/elbow"]


BALL_FAR_AWAY = (
    "<mujoco><asset><texture type='skybox' builtin='flat' rgb1='0 0 1' width='8' height='8'/></asset>"
    "<worldbody>{camera}<body pos='30 -20 5'><geom size='.1' rgba='1 0 0 1'/></body></worldbody></mujoco>"
)


def test_the_overview_of_a_model_without_a_camera_shows_all_of_it(tmp_path) -> None:
    (tmp_path / "ball.xml").write_text(BALL_FAR_AWAY.format(camera="<camera/>"))
    model = load_model("ball.xml", tmp_path)
    assert camera_names(model) == [OVERVIEW]  # the camera of the model has no name
    assert field_of_view_rad(model, OVERVIEW) == pytest.approx(np.deg2rad(45))
    picture = drawn(model)
    reddish = picture[:, :, 0] > picture[:, :, 2]
    rows, columns = np.nonzero(reddish)
    assert 0.05 < reddish.mean() < 0.6
    assert (rows.mean(), columns.mean()) == pytest.approx((60, 80), abs=8)


def test_the_overview_that_a_model_has_stays_its_own(tmp_path) -> None:
    own = "<camera name='overview' pos='30 -20 6' fovy='20'/>"
    (tmp_path / "ball.xml").write_text(BALL_FAR_AWAY.format(camera=own))
    model = load_model("ball.xml", tmp_path)
    assert camera_names(model) == [OVERVIEW]
    assert field_of_view_rad(model, OVERVIEW) == pytest.approx(np.deg2rad(20))


def test_a_renderer_names_the_cameras_of_the_model() -> None:
    with pytest.raises(ModelError, match="no camera named 'tap'; it has top, front, wrist, overview"):
        CameraRenderer(load_model("so_arm100/scene.xml"), "tap", 64, 48)


def drawn(model: mujoco.MjModel) -> np.ndarray:
    """A picture of the overview at the start of a model."""
    physics = Physics(model)
    renderer = CameraRenderer(model, OVERVIEW, 160, 120)
    try:
        renderer.look(physics.data)
        return renderer.draw()
    finally:
        renderer.close()


def test_links_of_a_urdf_do_not_collide_with_what_they_turn_on(tmp_path) -> None:
    ball = "<collision><geometry><sphere radius='0.2'/></geometry></collision>"
    mass = "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>"
    (tmp_path / "arm.urdf").write_text(
        f"<robot name='r'><link name='base'>{mass}{ball}</link><link name='tip'>{mass}{ball}</link>"
        "<joint name='elbow' type='continuous'><parent link='base'/><child link='tip'/>"
        "<axis xyz='0 0 1'/></joint></robot>"
    )
    physics = Physics(load_model("arm.urdf", tmp_path))
    assert physics.data.ncon == 0
    physics.group(()).set_command(np.array([1.0]))
    physics.step(2000)
    assert physics.group(()).position_rad == pytest.approx([1.0], abs=0.02)


def test_unknown_name_says_the_nearest(tmp_path) -> None:
    with pytest.raises(ModelError, match=r"so_arm/scene.xml.*does not exist.*nearest: so_arm100/scene.xml"):
        load_model("so_arm/scene.xml", tmp_path)


def test_malformed_model_says_file_and_line(tmp_path) -> None:
    (tmp_path / "bad.xml").write_text(
        "<mujoco>\n<worldbody>\n<geom size='1' colour='red'/>\n</worldbody></mujoco>"
    )
    with pytest.raises(ModelError, match=r"bad.xml is not a model.*colour.*line 3.*correct the file"):
        load_model("bad.xml", tmp_path)


def test_folder_in_place_of_a_file_is_named(tmp_path) -> None:
    with pytest.raises(ModelError, match="is a folder"):
        model_file(".", tmp_path)


@pytest.mark.parametrize("name", [model.mjx for model in PACKAGED_MODELS if model.mjx])
def test_variants_for_accelerators_solve_well_and_touch_little(name: str) -> None:
    model = load_model(name)
    assert model.opt.iterations >= 12
    assert model.opt.ls_iterations >= 15
    for geom in (model.geom(index) for index in range(model.ngeom)):
        if "_pad_" in geom.name:
            assert (geom.contype[0], geom.conaffinity[0]) == (0, 0), geom.name
        if geom.name.endswith("_grip"):  # which meets nothing but the cube
            assert (geom.contype[0], geom.conaffinity[0]) == (8, 0), geom.name
    met = [model.geom(index).name for index in range(model.ngeom) if model.geom_conaffinity[index] & 8]
    assert set(met) <= {"cube"}


def test_meshes_that_are_git_lfs_pointers_are_named(tmp_path):
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    (tmp_path / "assets").mkdir()
    (tmp_path / "assets" / "link.stl").write_text(pointer)
    body = '<worldbody><body><joint name="pan"/><geom type="mesh" mesh="link"/></body></worldbody>'
    (tmp_path / "arm.xml").write_text(
        '<mujoco><compiler meshdir="assets"/>'
        f'<asset><mesh name="link" file="link.stl"/></asset>{body}</mujoco>'
    )
    with pytest.raises(ModelError, match=r"link\.stl is a Git LFS pointer: .* Run git lfs install, then"):
        load_model(str(tmp_path / "arm.xml"))
    urdf = (
        '<robot name="arm"><link name="base"/><link name="link"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>'
        '<mesh filename="assets/link.stl"/></geometry></collision></link><joint name="pan" type="revolute">'
        '<parent link="base"/><child link="link"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        "</joint></robot>"
    )
    (tmp_path / "arm.urdf").write_text(urdf)
    with pytest.raises(ModelError, match=r"arm\.urdf cannot be compiled: .*link\.stl is a Git LFS pointer"):
        load_model(str(tmp_path / "arm.urdf"))
