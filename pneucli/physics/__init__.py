"""The equations: gas and orifice flow, friction laws, and one file for each physical effect."""
