"""Serial arms of any number of joints as URDF, for tests and benchmarks."""


def serial_arm(joints):
    """An upright arm whose axes alternate between roll and pitch; links get lighter towards the tool."""
    text = '<robot name="arm"><link name="l0"/>'
    for k in range(joints):
        mass, length = 8.0 * 0.75**k, 0.35 * 0.9**k
        about, slim = mass * length**2 / 12 + 0.01, mass * 0.004 + 0.002
        axis = "0 0 1" if k % 2 == 0 else "0 1 0"
        rise = 0.15 if k == 0 else 0.35 * 0.9 ** (k - 1)
        text += (
            f'<link name="l{k + 1}"><inertial><origin xyz="0.02 0 {length / 2}"/><mass value="{mass}"/>'
            f'<inertia ixx="{about}" iyy="{about}" izz="{slim}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{k + 1}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0 0 {rise}"/>'
            f'<axis xyz="{axis}"/><limit lower="-2.8" upper="2.8" effort="{200 * 0.7**k}" velocity="2"/></joint>'
        )
    return text + "</robot>"
