"""Requirements are pinned to the oldest versions that they allow."""

from __future__ import annotations

from oldest_versions import oldest_versions


def test_the_highest_lower_bound_of_each_distribution_is_pinned() -> None:
    requirements = [
        "numpy>=1.26",
        "numpy>=1.26,<3",
        "numpy>=1.27",
        "opencv-python-headless>=4.10,<6",
        "shtab",
        "pyserial>=3.5 ; sys_platform == 'none'",
        "fsspec[s3]>=2024.1",
    ]
    assert oldest_versions(requirements) == [
        "fsspec[s3]==2024.1",
        "numpy==1.27",
        "opencv-python-headless==4.10",
        "shtab",
    ]
