def play(x):return 3 if x[7]<=-0.11404599222520956 else (3 if x[6]<=1.612876649239381 else 0) if x[7]<=0.0153143845364892 else 0
