def play(x):return 4 if x[0]<=20.734890816672284 else 0 if x[3]<=2.0 else 3 if x[3]<=4.0 else 0
