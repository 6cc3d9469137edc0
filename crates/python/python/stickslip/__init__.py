"""Vibration of structures with dry-friction joints: exact and fast, with error measures.

A :class:`Study` is read from a study file; a :class:`Model` is built by method calls. Both give a
:class:`Result`: tables that pandas, polars and NumPy read without a copy, a figure, and the record
of the run.

>>> import stickslip
>>> result = stickslip.Study.from_template("blade-couple-massless", Ft="2 N").run()
>>> result["peaks"].columns[:3]
['Ft_N', 'mass', 'frequency_Hz']
"""

from . import statistics
from ._campaign import Campaign, campaign
from ._core import Explorer, Law, Model, Orbit, Residuals, Result, Study, Table, __version__, law, laws, templates
from ._errors import MethodError, ModelError, OrbitError, ReportError, StickslipError, StudyError
from ._folder import CampaignError
from ._identify import Identification, identify
from ._rate import rate_law

__all__ = [
    "Campaign",
    "CampaignError",
    "Explorer",
    "Identification",
    "Law",
    "MethodError",
    "Model",
    "ModelError",
    "Orbit",
    "OrbitError",
    "ReportError",
    "Residuals",
    "Result",
    "StickslipError",
    "Study",
    "StudyError",
    "Table",
    "__version__",
    "campaign",
    "identify",
    "law",
    "laws",
    "rate_law",
    "statistics",
    "templates",
]
