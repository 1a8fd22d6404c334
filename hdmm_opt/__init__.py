"""hdmm-opt: optimization-centred design of controllers for heavy-duty mobile machines."""
