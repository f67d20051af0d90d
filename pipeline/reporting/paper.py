"""What the paper prints, and how its methods and settings are named and ordered in reports."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

ACCURACY = ("rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t", "error_r_deg", "error_t")
MAE_AND_ERROR = ("mae_r_deg", "mae_t", "error_r_deg", "error_t")
UNSEEN_OBJECTS = "modelnet40-unseen_objects"
FLOORS = ("identity", "constant", "icp_centroid")


@dataclass(frozen=True)
class Shown:
    """How a method appears in a report."""

    name: str
    kind: Literal["floor", "classical", "learned"]


METHODS = {  # the order of the rows; a method that is not here follows under its own name
    "identity": Shown("Identity", "floor"),
    "constant": Shown("Constant (mean pose)", "floor"),
    "icp_centroid": Shown("ICP from the centroids", "floor"),
    "icp": Shown("ICP", "classical"),
    "trimmed_icp": Shown("Trimmed ICP", "classical"),
    "gicp": Shown("Generalized ICP", "classical"),
    "fgr": Shown("FGR", "classical"),
    "ransac_fpfh": Shown("RANSAC on FPFH", "classical"),
    "small_gicp": Shown("small_gicp", "classical"),
    "kiss_matcher": Shown("KISS-Matcher", "classical"),
    "pointnetlk": Shown("PointNetLK", "learned"),
    "pcrnet": Shown("PCRNet", "learned"),
    "deepgmr": Shown("DeepGMR", "learned"),
    "dcp_v1": Shown("DCP v1", "learned"),
    "dcp_v2": Shown("DCP v2", "learned"),
    "fmr": Shown("FMR", "learned"),
    "rpmnet": Shown("RPMNet", "learned"),
    "egst": Shown("EGST", "learned"),
    "pcrdiffusion_cf": Shown("PCRDiffusion CF", "learned"),
    "pcrdiffusion_cb": Shown("PCRDiffusion CB", "learned"),
}


@dataclass(frozen=True)
class Place:
    """Where a scenario or an ablation stands in the paper."""

    table: str
    title: str


SCENARIOS = {  # the order of the tables; a scenario that is not here is an extra one
    UNSEEN_OBJECTS: Place("1a", "ModelNet40, unseen objects"),
    "modelnet40-unseen_categories": Place("1b", "ModelNet40, unseen categories"),
    "modelnet40-gaussian_noise": Place("1c", "ModelNet40, Gaussian noise"),
    "modelnet40-partial": Place("1d", "ModelNet40, partial overlap"),
    "kitti": Place("2", "KITTI"),
    "3dmatch": Place("2", "3DMatch"),
    "modelnet40-resampled": Place("extra", "ModelNet40, sampled independently"),
    "modelnet40-so3": Place("extra", "ModelNet40, any rotation"),
    "3dmatch-pairs": Place("extra", "3DMatch, overlapping fragments"),
    "kitti-pairs": Place("extra", "KITTI, overlapping scans"),
}
ABLATIONS = {  # by the stem of the file under results/ablations: also what it varies first
    "diffusion": Place("3", "With and without diffusion"),
    "representation": Place("4", "What is diffused"),
    "fusion": Place("5", "Where the noisy pose is fused"),
    "steps": Place("7", "Sampling steps"),
    "hypotheses": Place("extra", "Several starts, the answer chosen without the truth"),
    "noise": Place("extra", "Noise added at the test"),
}
TIMING = Place("6", "Accuracy and speed")
VALUES = {  # the order of an ablation's values where it is not their natural one
    "sampler": ("ddpm", "ddim"),
    "diffusion": ("without", "with"),
    "representation": (
        "quaternion", "euler", "rotation_6d", "twist", "dual_quaternion", "matrix",
    ),
    "scaling": ("raw", "standardised"),
    "fusion": ("concat", "target", "source"),
}  # fmt: skip
CONCAT = ("5", "fusion=concat")
"""The table and setting of a row that the paper names and prints no numbers for."""
BOUND = 1e-10
"""What Table 6 prints as "< 1e-10" s is a bound."""
CORRESPONDENCE_FREE = ("pointnetlk", "pcrnet", "fmr")
CORRESPONDENCE_BASED = ("icp", "fgr", "deepgmr", "dcp_v2", "rpmnet")
"""The paper's own division of what it compares with, in its order of rows."""
RIVALS: dict[str, tuple[str, ...]] = {
    "pcrdiffusion_cf": CORRESPONDENCE_FREE,
    "pcrdiffusion_cb": CORRESPONDENCE_BASED,
}


class Number(NamedTuple):
    """Which of the paper's numbers."""

    table: str
    scenario: str
    method: str
    setting: str
    metric: str


# Columns: RMSE(R), RMSE(t), MAE(R), MAE(t), ERROR(R), ERROR(t); angles in degrees.
_MAIN = {
    UNSEEN_OBJECTS: """
        icp             21.2084 0.2874 11.7468 0.1686 23.1548 0.3497
        pointnetlk       7.4796 0.5820  1.7362 0.4907  4.0421 0.9741
        pcrnet          19.8457 0.2288 10.2498 0.1168 19.0487 0.2442
        deepgmr         34.1993 0.4495 23.5162 0.3291 45.7786 0.6758
        fgr              9.5964 0.1186  1.9971 0.0268  4.3337 0.0582
        dcp_v2          15.7183 0.2002 10.7846 0.1340 20.8744 0.2740
        fmr              6.8525 0.5851  1.5962 0.4886  3.8090 0.9751
        rpmnet           8.0357 0.0841  1.4399 0.0170  2.9619 0.0357
        pcrdiffusion_cf  3.3737 0.0460  1.6861 0.0216  3.2786 0.0448
        pcrdiffusion_cb  1.0986 0.0218  0.7244 0.0153  1.2732 0.0318
    """,
    "modelnet40-unseen_categories": """
        icp             21.8745 0.2707 11.0308 0.1588 21.9911 0.3307
        pointnetlk       8.7766 0.5702  2.3269 0.4768  5.5023 0.9555
        pcrnet          22.0931 0.2943 15.4301 0.1946 29.3938 0.3978
        deepgmr         35.2986 0.4520 22.6519 0.3314 43.7901 0.6816
        fgr             10.6061 0.1214  2.3841 0.0312  5.2151 0.0672
        dcp_v2          21.4669 0.3194 15.2743 0.2357 29.3084 0.4834
        fmr              7.5793 0.5667  1.8031 0.4750  4.4476 0.9434
        rpmnet           5.3739 0.0736  1.1452 0.0144  2.5072 0.0316
        pcrdiffusion_cf  3.1880 0.0447  1.6887 0.0216  3.1686 0.0446
        pcrdiffusion_cb  0.2848 0.0045  0.0969 0.0031  0.1790 0.0066
    """,
    "modelnet40-gaussian_noise": """
        icp             20.3257 0.2696 11.5025 0.1627 22.4326 0.3356
        pointnetlk       7.5379 0.5771  2.1857 0.4823  4.8129 0.9628
        pcrnet          25.9025 0.3257 14.9771 0.1987 31.5003 0.4115
        deepgmr         34.0033 0.4573 23.4370 0.3364 45.1482 0.6922
        fgr             12.2387 0.1278  3.1348 0.0387  6.6048 0.0822
        dcp_v2          22.2084 0.3312 16.5101 0.2464 31.3406 0.5000
        fmr              7.6332 0.5797  2.2957 0.4844  5.1395 0.9651
        rpmnet           9.4977 0.0884  2.7392 0.0310  5.9164 0.0673
        pcrdiffusion_cf  3.2549 0.0462  1.6707 0.0220  3.2145 0.0456
        pcrdiffusion_cb  1.0766 0.0218  0.7035 0.0152  1.2529 0.0316
    """,
    "modelnet40-partial": """
        icp             24.8634 0.3520 14.8698 0.2211 29.1252 0.4610
        pointnetlk      22.1867 0.5812 13.1504 0.4786 26.1196 0.9633
        pcrnet          21.7402 0.2902 14.2114 0.1990 28.2444 0.4061
        deepgmr         34.6393 0.4706 24.7054 0.3465 47.8755 0.7078
        fgr             22.7562 0.2641  8.9966 0.1110 17.2071 0.2289
        dcp_v2          24.0230 0.3686 17.8908 0.2772 34.1244 0.5633
        fmr             15.5280 0.5772  9.5682 0.4777 19.0777 0.9595
        rpmnet          11.0629 0.1912  5.7625 0.1229 11.7768 0.2598
        pcrdiffusion_cb  3.8197 0.0862  2.5673 0.0598  4.7319 0.1250
    """,
    # Table 2 prints one row "PCRDiffusion" and does not say which; it stands beside CB here.
    "kitti": """
        icp             18.9487  0.5466 12.6160 0.3563 20.6026  0.7752
        pointnetlk       7.0309  0.6846  0.8580 0.5257  1.4041  1.0589
        pcrnet          33.0369  6.8900 22.3317 5.4069 39.5509 10.7703
        deepgmr         46.6050  0.4386 25.8622 0.2657 44.0679  0.5785
        fgr             13.9026  1.3483  1.7946 0.1454  3.2000  0.3053
        dcp_v2          18.1473 10.7517 12.8834 7.4273 22.4225 16.3362
        fmr              7.5326  0.7692  1.4277 0.5663  2.2495  1.1334
        rpmnet          35.9824  0.7544 19.4641 0.3966 34.4617  0.8745
        pcrdiffusion_cb  0.6281  0.0209  0.3556 0.0129  0.8237  0.0282
    """,
    "3dmatch": """
        icp             25.4376 0.8635 13.9470 0.4202 25.7505 0.8614
        pointnetlk       2.1669 0.5779  0.3797 0.4792  0.6542 0.9653
        pcrnet          32.5824 1.3655 25.3004 1.0562 49.4726 2.1123
        deepgmr         38.3840 1.2166 26.2025 0.8146 48.0517 1.6224
        fgr              1.5866 0.0810  0.2477 0.0099  0.4764 0.0200
        dcp_v2          29.7272 1.2919 23.0550 0.9689 44.0671 1.9137
        fmr              3.3293 0.5690  0.6072 0.4712  1.0811 0.9423
        rpmnet          21.1454 0.4963  8.3353 0.2179 15.5514 0.4395
        pcrdiffusion_cb  0.1522 0.0061  0.1123 0.0040  0.2109 0.0081
    """,
}
# Columns: MAE(R), MAE(t), ERROR(R), ERROR(t). Table 5 prints no numbers for `fusion=concat`.
_ABLATED = {
    "3": """
        pcrdiffusion_cf diffusion=without 81.5854 0.4052 168.0197 0.7960
        pcrdiffusion_cb diffusion=without  6.3867 0.0698  12.7412 0.1429
        pcrdiffusion_cf diffusion=with     1.6861 0.0216   3.2786 0.0448
        pcrdiffusion_cb diffusion=with     0.7244 0.0153   1.2732 0.0318
    """,
    "4": """
        pcrdiffusion_cb representation=quaternion,scaling=raw 0.7244 0.0153  1.2732 0.0318
        pcrdiffusion_cb representation=euler,scaling=raw      6.8240 0.0733 13.7542 0.1513
    """,
    "5": """
        pcrdiffusion_cf fusion=target 1.6887 0.0216 3.1686 0.0446
        pcrdiffusion_cf fusion=source 1.6861 0.0216 3.2786 0.0448
    """,
    "7": """
        pcrdiffusion_cf steps=1,sampler=ddpm 1.6861 0.0216 3.2786 0.0448
        pcrdiffusion_cf steps=2,sampler=ddpm 1.6625 0.0215 3.1962 0.0445
        pcrdiffusion_cf steps=4,sampler=ddpm 1.6625 0.0215 3.1962 0.0445
        pcrdiffusion_cf steps=8,sampler=ddpm 1.6625 0.0215 3.1962 0.0445
    """,
}
# Table 6; its accuracy columns repeat Table 1 (a). CF is printed as "< 1e-10": a bound.
_SECONDS = """
    icp 0.0042 pointnetlk 0.7111 pcrnet 1.2318 deepgmr 0.1053 fgr 0.0916 dcp_v2 0.2819
    fmr 1.0472 rpmnet 0.1626 pcrdiffusion_cf 1e-10 pcrdiffusion_cb 0.0986
"""


def _read_main() -> dict[Number, float]:
    printed: dict[Number, float] = {}
    for scenario, text in _MAIN.items():
        table = SCENARIOS[scenario].table
        for method, *values in map(str.split, text.strip().splitlines()):
            for metric, value in zip(ACCURACY, values, strict=True):
                printed[Number(table, scenario, method, "paper", metric)] = float(value)
                if table == "1a" and metric in MAE_AND_ERROR:
                    printed[Number(TIMING.table, scenario, method, "paper", metric)] = float(value)
    return printed


def _read_ablated() -> dict[Number, float]:
    printed: dict[Number, float] = {}
    for table, text in _ABLATED.items():
        for method, setting, *values in map(str.split, text.strip().splitlines()):
            for metric, value in zip(MAE_AND_ERROR, values, strict=True):
                number = Number(table, UNSEEN_OBJECTS, method, setting, metric)
                printed[number] = float(value)
    words = _SECONDS.split()
    for method, value in zip(words[::2], words[1::2], strict=True):
        number = Number(TIMING.table, UNSEEN_OBJECTS, method, "paper", "seconds")
        printed[number] = float(value)
    return printed


PRINTED: dict[Number, float] = _read_main() | _read_ablated()


def printed(number: Number) -> float | None:
    """Give the paper's number, or None where it prints none.

    A row run with the authors' own settings (``official``) stands beside the same number.
    """
    setting = "paper" if number.setting == "official" else number.setting
    return PRINTED.get(number._replace(setting=setting))


def shown(method: str) -> Shown:
    """Give a method's name and kind; one nobody has named counts as learned."""
    return METHODS.get(method, Shown(method, "learned"))


def method_rank(method: str) -> tuple[int, str]:
    """Sort key that puts methods in the order of the rows."""
    order = list(METHODS)
    return (order.index(method) if method in METHODS else len(order), method)


def scenario_rank(scenario: str) -> tuple[int, str]:
    """Sort key that puts scenarios in the order of the tables."""
    order = list(SCENARIOS)
    return (order.index(scenario) if scenario in SCENARIOS else len(order), scenario)


def place(scenario: str) -> Place:
    """Give a scenario's table and title; one the paper does not have is ``extra``."""
    return SCENARIOS.get(scenario, Place("extra", scenario))
