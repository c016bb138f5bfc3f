"""Direct identification of a valve from charge and discharge curves, and the lack of fit of the model to them."""
