"""A problem as an environment of Gymnasium, and an agent trained on it as a policy; needs the extra `gym`."""

from hevopt.errors import DataError

try:
    import gymnasium  # noqa: F401
except ImportError:
    raise DataError(
        'hevopt.gym needs Gymnasium, which is not installed; needed: pip install "hevopt[gym]"'
    ) from None

from hevopt.gym.environment import HybridEnv
from hevopt.gym.observation import OBSERVED, as_policy

__all__ = ["OBSERVED", "HybridEnv", "as_policy"]
