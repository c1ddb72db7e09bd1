"""What lagcli costs: beside a yardstick of the same numerical work, and beside other programs.

python -m tests.benchmarks --help
"""
