"""Why a control cannot be used at a step: bits, and the words for them."""

from enum import IntFlag


class Reject(IntFlag):
    """Why a control cannot be used at a step."""

    ENGINE_TORQUE = 1
    ENGINE_SPEED = 2
    ENGINE_MAP = 4
    MACHINE_LIMIT = 8
    MACHINE_SPEED = 16
    BATTERY_LIMIT = 32
    NO_PATH = 64
    FUNCTION = 128
    DUPLICATE = 256
    GIVEN = 512
    MACHINE_MAP = 1024
    BEATEN = 2048
    BRAKING = 4096
    GEARBOX_MAP = 8192


REJECT_WORDS: dict[Reject, str] = {
    Reject.ENGINE_TORQUE: "engine torque",
    Reject.ENGINE_SPEED: "engine speed",
    Reject.ENGINE_MAP: "outside the engine map",
    Reject.MACHINE_LIMIT: "machine torque or power",
    Reject.MACHINE_SPEED: "machine speed",
    Reject.BATTERY_LIMIT: "battery limit",
    Reject.NO_PATH: "torque does not reach the wheels",
    Reject.FUNCTION: "function not in the architecture",
    Reject.DUPLICATE: "same as another control",
    Reject.GIVEN: "marked as not feasible",
    Reject.MACHINE_MAP: "outside the machine map",
    Reject.BEATEN: "beaten by another control",
    Reject.BRAKING: "more braking than the machine's axle may take",
    Reject.GEARBOX_MAP: "outside the gearbox map",
}
