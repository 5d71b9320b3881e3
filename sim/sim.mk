lint gen gen-check firmware faults:
