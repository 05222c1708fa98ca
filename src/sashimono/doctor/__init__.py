"""What an input is like before it is planned: size and unit, surfaces, overlaps, clearances, what touches what."""

from sashimono.doctor.config import DoctorConfig
from sashimono.doctor.examine import examine
from sashimono.doctor.findings import Diagnosis, Finding
from sashimono.doctor.report import diagnosis_as_dict, diagnosis_lines

__all__ = ["Diagnosis", "DoctorConfig", "Finding", "diagnosis_as_dict", "diagnosis_lines", "examine"]
