"""What an input is like before it is planned: size and unit, surfaces, overlaps, clearances, what touches what."""

from sashimono.examination.config import DoctorConfig
from sashimono.examination.examine import examine
from sashimono.examination.findings import Diagnosis, Finding
from sashimono.examination.report import diagnosis_as_dict, diagnosis_lines

__all__ = ["Diagnosis", "DoctorConfig", "Finding", "diagnosis_as_dict", "diagnosis_lines", "examine"]
