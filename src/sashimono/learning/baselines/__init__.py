"""The networks that the paper compares with, adapted to several parts as it says."""
