"""Lee (2010), Sensors 10, 9424: GPS/INS with a network of reference stations, three cases."""
