def play(x):return (0 if x[1]<=-7.485794390666098 else 1 if x[2]<=-5.193856439743943 else 0) if x[0]<=0.0 else 1
