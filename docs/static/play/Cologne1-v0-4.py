def play(x):return (0 if x[17]<=7.5 else 2) if x[10]<=0.5 else 0 if x[17]<=-1.5 else 2
