"""Laws that several components share, as functions of CasADi expressions."""
