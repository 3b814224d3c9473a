def play(x):return ((((5 if x[3]<=2.5 else 2) if x[0]<=30.963914992909054 else 0) if x[3]<=3.0 else 6) if x[1]<=30.00041166201465 else 0) if x[3]<=5.5 else 5 if x[0]<=22.756981099030252 else 0
