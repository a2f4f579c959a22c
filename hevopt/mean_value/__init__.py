"""A turbocharged diesel cycle by cycle on average: five volumes, turbocharger, control unit, and a car's tip-in."""
